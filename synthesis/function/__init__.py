"""Function generation: linkages whose rocker turns as a wanted function of the crank's angle."""
