"""Where the commands of this package start: Ctrl-C is silent until they run, and only what they need is loaded."""

from materials.foundation.early_interrupt import end_silently

end_silently()


def scene_build() -> int:
    """Run `scene-build`."""
    from .cli import main

    return main()
