"""Where each vehicle should be."""
