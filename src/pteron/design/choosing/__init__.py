"""The choice of a kind of machine, its dimensions and its drives for what it must do."""
