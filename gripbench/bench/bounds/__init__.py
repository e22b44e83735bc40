"""What anybody could reach with the car on paper: posterior Cramer-Rao bounds."""
