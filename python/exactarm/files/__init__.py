"""Files as they come: bytes within the memory that is free, TOML, tables (CSV, Parquet), shipped examples."""
