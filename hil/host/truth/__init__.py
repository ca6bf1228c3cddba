"""Where ground truth may go: the policy, the endpoint that sends it, and a logger that receives it."""
