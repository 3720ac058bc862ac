"""Results of measurements: samples, quantiles, tables, the machine."""
