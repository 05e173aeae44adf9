"""Statistics of errors and tracks: mergeable moments, curves over age, lifetimes, outlier ratios, trimming."""
