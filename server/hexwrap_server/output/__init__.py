"""What is handed out: the Result and the files made of it."""
