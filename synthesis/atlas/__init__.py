"""The wavelet atlas: Haar features of every dimension type's coupler rotation, its file, and the exact scan of it."""
