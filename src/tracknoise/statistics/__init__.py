"""What the errors look like: mergeable moments, curves over age, lifetimes, outlier ratios, trimming."""
