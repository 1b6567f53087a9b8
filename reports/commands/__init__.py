"""What the commands do: check what is asked, run, judge, write, show."""
