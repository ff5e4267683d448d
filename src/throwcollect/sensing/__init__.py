"""What cameras and lidars see of a recorded state: triangles, pictures and ranges, with the same bits everywhere.

Frames are functions of the samples of an episode and of the descriptions of robot and bodies. This room knows neither
engines nor files of datasets.
"""
