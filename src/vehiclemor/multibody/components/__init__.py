"""Parts that vehicle models share: chassis, wheels, tires."""
