"""What the tables are made of: column schemas, and the run folder that holds them as Parquet."""
