"""What runs come to: measures, tables, figures."""
