"""The coordinator: gives trials to simulations and their episodes to the dataset."""
