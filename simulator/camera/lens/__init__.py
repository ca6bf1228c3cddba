"""The lens: intrinsics, distortion, projection, camera files. No light levels and no noise."""
