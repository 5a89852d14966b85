"""Trees and values from and to files and other libraries."""
