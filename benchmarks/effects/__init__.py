"""What effects of cameras and faults of the truth do to the results, each alone at three sizes."""
