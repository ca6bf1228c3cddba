"""Labels of images of every recipe against rays through each pixel of the exported mesh, by an independent program."""
