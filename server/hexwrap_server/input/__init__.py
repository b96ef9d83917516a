"""What is sent or read: requests, surfaces, drawings."""
