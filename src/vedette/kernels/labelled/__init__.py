"""Label sets, conversions between labelled densities, inner products, generalized covariance intersection."""
