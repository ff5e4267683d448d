"""The image as one file that Apptainer and Singularity run, as clusters have them."""
