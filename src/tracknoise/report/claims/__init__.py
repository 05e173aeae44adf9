"""What the paper claims, judged by what a run measured under three readings of its trimming."""
