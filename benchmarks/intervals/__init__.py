"""Whether intervals, limits and stop times hold on machines that are not the law."""
