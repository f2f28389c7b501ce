"""The reference page: every printed number of the paper beside a study's, as Markdown with pictures."""
