"""What propagators of polynomial chaos share."""
