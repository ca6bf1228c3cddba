"""Labels of images of every recipe against rays through each pixel, cast on the exported mesh by another program."""
