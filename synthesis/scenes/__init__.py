"""Three machines beside the linkages: a pneumatic lift, a chain on a U-shaped slide, a knotter."""
