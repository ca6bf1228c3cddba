"""The only folder that imports moderngl: context, programs, targets, passes."""
