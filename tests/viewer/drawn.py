def judged(out):
    return ""
