"""Monte Carlo studies: many synthetic rooms, and how often what is claimed of them is true."""
