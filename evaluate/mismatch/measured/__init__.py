"""The diagnosis of measurements without a picture: BRDFs over directions, spectra under conditions, photometric stereo."""
