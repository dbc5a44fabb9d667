"""From tables as people keep them to a campaign: one step a file, in this order.

`sources` opens files, `delimited` and `workbook` read cells, `sheet` finds the header, `numbers` the decimal
sign. `mapping` holds what was declared, `meaning` what a header says, `questions` what nobody said.
`readings` and `places` read one cell, `track_table`, `wide_table` and `five_files` a table, `joined` puts
several together. `draft` is the campaign before it is written, `understanding` what is shown of it, and
`steps` does it all.
"""

from skred.importing.mapping import Mapping, read_mapping
from skred.importing.questions import Question, Unclear
from skred.importing.steps import Files, Imported, import_tables, write_imported

__all__ = [
    "Files",
    "Imported",
    "Mapping",
    "Question",
    "Unclear",
    "import_tables",
    "read_mapping",
    "write_imported",
]
