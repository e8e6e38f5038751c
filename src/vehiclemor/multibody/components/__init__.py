"""What vehicles share: chassis, wheels, tires."""
