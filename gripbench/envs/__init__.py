"""The world: vehicles, tyres, plants, roads, drivers, sensors and the Gymnasium environment."""
