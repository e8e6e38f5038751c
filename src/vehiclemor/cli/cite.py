"""`vehiclemor cite`: how to cite."""


def cite() -> int:
    """Print how to cite this suite, the paper, and the methods with a reference of their own."""
    from vehiclemor.report.published import citations

    print(citations())
    return 0
