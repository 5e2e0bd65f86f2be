"""Linear algebra, Kalman steps, information rows, mixtures and pools of Gaussians."""
