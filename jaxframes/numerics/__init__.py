"""Components of vectors and quaternions: algebra, assembling, fencing, sine and cosine. Knows no frame."""
