class Color(object):
    def __init__(self, red, green, blue):
        self.R, self.G, self.B = red, green, blue

    @staticmethod
    def FromArgb(red, green, blue):
        for part in (red, green, blue):
            assert isinstance(part, int) and 0 <= part <= 255
        return Color(red, green, blue)
