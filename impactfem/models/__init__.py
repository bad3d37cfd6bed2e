"""What a scene is once meshed and discretised; kept, so that plan and run share it."""
