"""Writers of files for any linkage: tables, drawings and simulation models."""
