from lockstep.server import errors


def _leaves(kind: type[errors.ConsoleError]) -> list[type[errors.ConsoleError]]:
    below = kind.__subclasses__()
    return [leaf for each in below for leaf in _leaves(each)] if below else [kind]


def test_every_error_has_a_name_for_http_or_for_channels() -> None:
    for leaf in _leaves(errors.ConsoleError):
        if issubclass(leaf, errors.ChannelError):
            assert leaf.name != errors.ChannelError.name
        else:
            assert errors.http_error(leaf("")).status >= 400


def test_the_tree_at_the_top_of_the_file_is_complete() -> None:
    for leaf in _leaves(errors.ConsoleError):
        assert leaf.__name__ in (errors.__doc__ or "")
        assert leaf.__name__ in errors.__all__
