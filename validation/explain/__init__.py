"""Where the errors of a ground truth come from: structured explanations, and who is wrong where."""
