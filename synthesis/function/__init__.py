"""Function generation: which linkage's rocker turns as a wanted function of its crank's angle?"""
