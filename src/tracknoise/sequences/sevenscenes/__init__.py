"""7-Scenes (Shotton et al., CVPR 2013): a hand-held Kinect in rooms. See docs/formats/sevenscenes.md."""
