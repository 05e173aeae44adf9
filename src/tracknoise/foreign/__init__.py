"""Files that somebody else wrote: bounds that hold before a file is read or decoded, and errors of their parsers."""
