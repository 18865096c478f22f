"""The rows of a Parquet file as pyarrow reads them, as JSON: show_table.py FILE."""

import json
import sys

import pyarrow.parquet as pq

print(json.dumps(pq.read_table(sys.argv[1]).to_pylist()))
