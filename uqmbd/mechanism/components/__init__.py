"""What a component is: its parameters, its terms, and the values and bodies it works with."""
