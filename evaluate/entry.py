"""Where the commands of this package start: Ctrl-C is silent until they run, and only what they need is loaded."""

from materials.foundation.early_interrupt import end_silently

end_silently()


def meniscus() -> int:
    """Run `meniscus`."""
    from .command import main

    return main()


def flow_eval() -> int:
    """Run `flow-eval`."""
    from .cli import main

    return main()


def diagnose() -> int:
    """Run `diagnose`."""
    from .diagnose_cli import main

    return main()
