"""Published beside reproduced: numbers, times and claims of the paper."""
