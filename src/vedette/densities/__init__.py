"""What is believed about the targets: labelled and unlabelled multi-target densities with Gaussian-mixture tracks."""
