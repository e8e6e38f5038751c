"""The vehicle with 14 degrees of freedom: independent suspension, Magic Formula tires."""
