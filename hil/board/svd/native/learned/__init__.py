"""What the learned proposal computes: crops, convolutions, likelihood of attitudes; C, and its calls."""
