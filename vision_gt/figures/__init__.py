"""Pictures that stand by themselves."""
