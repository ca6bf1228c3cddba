"""What a board carries of a target: keypoints, wireframe, occluders, outer faces, contours. Nothing is drawn here."""
