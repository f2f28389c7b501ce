"""To and from what others read and write: CSV tables, ParaView, LAMMPS and LIGGGHTS, saved states of YADE."""
