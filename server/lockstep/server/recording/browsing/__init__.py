"""Lists the episodes of recordings and shows their pictures, without a cost for whoever drives."""
