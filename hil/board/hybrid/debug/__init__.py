"""Pictures of what each stage found, for people; never needed by an estimate."""
