"""Which claims hold: intervals, tests and verdicts, with the scene as the sampling unit.

Tables of one condition are small. Their columns are therefore computed one after another (`select_seq` and
`with_columns_seq`): handing them over to Polars' threads takes longer than computing them.
"""
