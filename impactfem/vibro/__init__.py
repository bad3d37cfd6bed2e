"""Systems of few degrees of freedom in time: event driven, position and velocity level."""
