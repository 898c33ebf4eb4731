"""The files of a search: the page on a choice of machines, the table and figure of a front."""
