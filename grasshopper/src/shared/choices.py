# --- words on inputs, and the value lists that offer them -------------------------------------------------
FRESH_LIST = ["1", "2", "3", "4"]  # what a new Value List holds


def choice(value, options, name):
    """The option that a text names, None for an empty input. Raises Refusal."""
    if value is None or not TEXT(value).strip():
        return None
    word = TEXT(value).strip().strip('"').lower()
    if word not in options:
        raise Refusal("%s must be one of %s, not '%s'." % (name, ", ".join(options), value))
    return word


def number(value, name):
    """A number from a text, with a decimal point or a decimal comma. Raises Refusal."""
    try:
        return float(TEXT(value).strip().replace(",", "."))
    except ValueError:
        raise Refusal("%s must be a number, not '%s'." % (name, value))


#: Words for a number of singularities, of which any will do.
COUNTS = ["auto", "0", "2", "4", "8"]


def count(value, name):
    """'auto' or a number of singularities, None for an empty input. Raises Refusal."""
    if value is None or not TEXT(value).strip():
        return None
    word = TEXT(value).strip().strip('"').lower()
    if word == "auto":
        return word
    most = number(word, "%s (auto, or a number)" % name)
    if most != int(most) or most < 0:
        raise Refusal("%s must be auto or a whole number that is not negative, not '%s'." % (name, value))
    return int(most)


def offer(component, choices):
    """Fills Value Lists that were just placed and wired to an input with the words this input takes."""
    document = component.OnPingDocument()
    for parameter in component.Params.Input:
        for source in parameter.Sources:
            # CPython sees no more than the interface that the list of sources promises.
            source = getattr(source, "__implementation__", source)
            items = getattr(source, "ListItems", None)
            if parameter.Name not in choices or items is None:
                continue
            if [item.Expression for item in items] == FRESH_LIST:
                later = fill_later(source, choices[parameter.Name])
                document.ScheduleSolution(1, Grasshopper.Kernel.GH_Document.GH_ScheduleDelegate(later))


def fill_later(source, words):
    """An upstream object may only be changed between two solutions."""

    def fill(document):
        source.ListItems.Clear()
        for word in words:
            source.ListItems.Add(Grasshopper.Kernel.Special.GH_ValueListItem(word, '"%s"' % word))
        source.ExpireSolution(False)

    return fill


def settings(values):
    """Only what was wired: the server has the defaults."""
    return dict((name, value) for name, value in values.items() if value is not None)
