"""Run a script of the user's own, which finds `yade_scripts` whatever folder this project is installed in.

own_script.py SCRIPT.py [ARGUMENT ...], by YADE or by its Python. SCRIPT sees its own arguments alone.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    # Last: installed, that folder holds the packages of another Python, which must not hide YADE's own
    sys.path.append(str(Path(sys.argv[0]).resolve().parent.parent))
    del sys.argv[0]
    __file__ = sys.argv[0]
    sys.path[0] = str(Path(__file__).resolve().parent)
    # In this very module: YADE, when imported, looks for names in __main__, where runpy would leave others
    exec(compile(Path(__file__).read_text(encoding="utf-8"), __file__, "exec", dont_inherit=True))
