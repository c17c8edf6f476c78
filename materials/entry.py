"""Where the commands of this package start: Ctrl-C is silent until they run, and only what they need is loaded."""

from materials.foundation.early_interrupt import end_silently

end_silently()


def material_fit() -> int:
    """Run `material-fit`."""
    from .cli import main

    return main()
